"""Taylor coefficients of a smooth field, from one tape of elementary operations."""
