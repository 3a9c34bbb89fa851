"""Judges recorded kernels on cards that are not there: translates, compiles, emulates and times them."""
