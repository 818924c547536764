"""The multiprecision route: heyoka in some hundred bits, and decisions in ball arithmetic."""
