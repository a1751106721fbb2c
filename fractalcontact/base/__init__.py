"""Shared infrastructure: validation, errors, labels and units, grids, spectra, transforms, threads, files."""
