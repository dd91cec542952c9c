"""Many runs: shared out over processes or a cluster, kept in shards, and judged by statistics."""
