"""The AMBF Description Format: schema, reader, diagnostics, path resolver, writer and patcher."""
