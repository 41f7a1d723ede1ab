"""Studies made with colloc; nothing reusable lives here."""
