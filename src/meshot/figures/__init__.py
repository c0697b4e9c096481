"""Pictures, and no mathematics."""
