"""rospy adapters: AMBF topics, CRTK topics, images."""
