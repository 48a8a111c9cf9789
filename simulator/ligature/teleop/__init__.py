"""Hands on: input devices, their pairing with arms, and what they feel. The core knows no transport."""
