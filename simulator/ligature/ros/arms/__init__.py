"""CRTK topics and services of the arms, as the da Vinci Research Kit has them (interface reference §5)."""

from ligature.ros.arms.node import ArmsNode

__all__ = ["ArmsNode"]
