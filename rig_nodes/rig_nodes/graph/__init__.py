"""The node graph as processes: domain, start, watch and end; used by `rig run` and by the tests. No ROS in here."""
