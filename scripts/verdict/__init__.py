"""How often the verdict, suspected data faults and the remedies for them are right."""
