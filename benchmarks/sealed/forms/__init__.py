"""Effects in other forms than the catalogue's laws; ``registry`` lists them."""
