"""Continuation: starts, steps and where they end."""

from __future__ import annotations
