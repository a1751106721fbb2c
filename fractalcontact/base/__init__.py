"""What every room stands on: names and units, errors, checks, the grid, transforms, files."""
