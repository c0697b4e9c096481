from .repeated_scans import averaged_scan as averaged_scan
