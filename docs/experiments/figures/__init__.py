"""What each experiment keeps of its campaigns, draws and tells: a file each, named as it is."""
