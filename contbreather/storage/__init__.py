"""Values as nested dicts, which each type says and reads, and one place that writes them."""
