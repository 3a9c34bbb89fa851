"""Pages of the site that repeat what the code says: generated at each build, so that none can go stale."""
