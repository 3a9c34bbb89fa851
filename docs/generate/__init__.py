"""Parts of the pages that repeat what the code says: generated, so that none can go stale."""
