"""What is measured in each room: methods, the knob of each, and a truth that they did not compute."""
