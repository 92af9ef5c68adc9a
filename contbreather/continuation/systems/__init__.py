"""Defining systems, branch points and normal forms."""

from __future__ import annotations
