"""Branches in files, loaded and extended."""

from __future__ import annotations
