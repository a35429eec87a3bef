"""Pictures, reports and recordings for the viewer."""
