"""Curves H(z) = 0: problems, their points and branches."""

from __future__ import annotations
