"""Bifurcations of equilibria and of maps."""

from __future__ import annotations
