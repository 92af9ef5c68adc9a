"""Periodic orbits of anybody's system, smooth, forced or hybrid, as cycles of flows."""

from __future__ import annotations

from .flow import Flow

__all__ = ["Flow"]
