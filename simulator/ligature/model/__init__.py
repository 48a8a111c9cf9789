"""The resolved scene: bodies, joints, trees and frames; engine-free, immutable, SI units."""
