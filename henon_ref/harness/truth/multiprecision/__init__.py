"""The multiprecision route: heyoka at some hundred bits, with decisions in ball arithmetic."""
