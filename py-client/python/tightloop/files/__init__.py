"""Files that users name or that the cache keeps; `tightloop.whole_files` writes them."""
