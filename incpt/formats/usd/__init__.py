"""Universal Scene Description: .usd, .usda, .usdc and .usdz."""
