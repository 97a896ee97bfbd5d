"""How fast motorctl is and how often its diagnoses are right: figures beside peers."""
