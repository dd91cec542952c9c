"""The live page: a test that runs, seen in the browser."""
