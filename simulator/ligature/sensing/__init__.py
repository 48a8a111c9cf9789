"""Ghost objects, rays, contact sensors and constraint actuators."""
