"""Newton's method, linear systems and derivatives."""

from __future__ import annotations
