"""What in the scene made a record: fits, with what they can and cannot see."""
