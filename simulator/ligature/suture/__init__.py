"""The rod that models a suture thread, its coupling to bodies, tissue holes and grasping."""

from ligature.suture.holes import Holes, Insertion
from ligature.suture.queries import RodQueries
from ligature.suture.rods import Rods
from ligature.suture.suture import Suture

__all__ = ["Holes", "Insertion", "RodQueries", "Rods", "Suture"]
