"""Return paths of an echo to the elements of an array: exact, straight, and by the vector approximation."""
