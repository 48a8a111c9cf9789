"""Plug-ins in Python that scene files name: their base class, what they may do, and the subsystem that runs them."""

from ligature.plugins.host import Host
from ligature.plugins.plugin import Plugin
from ligature.plugins.runner import AfterStep, Plugins

__all__ = ["AfterStep", "Host", "Plugin", "Plugins"]
