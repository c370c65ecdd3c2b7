import { defineConfig } from 'vitest/config';

// Figures of the studio; nothing else runs beside them.
export default defineConfig({
  test: {
    include: ['tests/bench/**/*.test.ts'],
    testTimeout: 180_000,
    hookTimeout: 60_000,
    fileParallelism: false,
    sequence: { concurrent: false },
  },
});
