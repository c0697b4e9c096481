"""Data that we make or that comes with a package: nothing here is downloaded."""
