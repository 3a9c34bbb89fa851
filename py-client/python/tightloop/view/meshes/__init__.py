"""Meshes, marks and ground that pages, pictures and films draw."""
