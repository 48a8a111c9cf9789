"""PyYAML: of the extension's wheel or of the system when there is one, else the packed pure-Python form."""

try:
    import yaml
except ImportError:
    from .vendor import yaml

__all__ = ["yaml"]
