"""From a scan to surfaces, step by step."""
