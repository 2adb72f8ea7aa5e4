"""What makes the tables and figures."""
