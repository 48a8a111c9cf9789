"""The AMBF Description Format: schema, reader, diagnostics, path resolver, writer and patcher."""

from ligature.adf.diagnostics import AdfError, Diagnostic, Mark, Severity
from ligature.adf.document import Document, Element
from ligature.adf.reader import (
    LaunchDocument,
    Reference,
    read_any,
    read_devices,
    read_launch,
    read_model,
    read_world,
)
from ligature.adf.resolver import ResolutionError, Resolver

__all__ = [
    "AdfError",
    "Diagnostic",
    "Document",
    "Element",
    "LaunchDocument",
    "Mark",
    "Reference",
    "ResolutionError",
    "Resolver",
    "Severity",
    "read_any",
    "read_devices",
    "read_launch",
    "read_model",
    "read_world",
]
