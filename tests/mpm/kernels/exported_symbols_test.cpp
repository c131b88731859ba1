#include "tests/exported_symbols.h"

TEST(ExportedSymbols, KernelsExportTheirTwoTablesAlone) {
  graupel::expect_exports(GRAUPEL_NM, GRAUPEL_KERNEL_OBJECTS, "graupel::mpm::[a-z0-9]+::kernels_f(32|64)", 2);
}
