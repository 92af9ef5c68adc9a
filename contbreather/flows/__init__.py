"""A flight from one time to another with its derivatives. Knows nothing of impacts."""

from __future__ import annotations
