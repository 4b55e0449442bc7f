"""What a YAML file says, checked."""
