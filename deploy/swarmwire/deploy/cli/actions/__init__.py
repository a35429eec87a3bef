"""The actions of the commands. The modules load the simulator, so a command imports its action when it is called."""
