"""Mutated scene and mesh files: every one ends as a success or as a located finding."""
