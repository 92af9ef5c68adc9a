"""Branches in files, loaded and extended."""
