"""CRTK topics and services of the arms, as the da Vinci Research Kit has them."""

from ligature.ros.arms.node import ArmsNode

__all__ = ["ArmsNode"]
