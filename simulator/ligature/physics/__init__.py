"""Rigid bodies on Bullet: articulations, springs, controllers, contacts."""
