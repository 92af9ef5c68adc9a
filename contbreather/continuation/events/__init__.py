"""Events along a curve: detected and located."""

from __future__ import annotations
