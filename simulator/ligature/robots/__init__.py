"""Surgical arms free of transport: kinematics, CRTK behaviour, trajectories."""
