"""The rod that models a suture thread, its coupling to bodies, tissue holes and grasping."""
