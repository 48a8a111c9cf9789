"""The live web page of a running simulator: the scene in 3D, its arms, cameras and figures, in any browser.

A front end like the window: it reads snapshots from the bus and sends commands through its own ring, so that it never
slows physics. One browser operates, any number watch. World axes, metres, radians; people read millimetres and degrees.
"""
