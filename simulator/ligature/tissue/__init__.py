"""Soft tissue: grids of elastic hexahedra that needles puncture anywhere, coupled by the step's own compliance."""
