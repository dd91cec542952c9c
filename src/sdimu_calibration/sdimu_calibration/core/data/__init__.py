"""Samples before any estimate: sound or not, gaps, rests and turns, units and senses of foreign recordings."""
