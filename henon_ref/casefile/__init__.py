"""What a case file may say: YAML, schema, expressions, scenes and their effects."""
