// vantage-keygen: makes the key that robot and workstation share.

#include <cstdio>
#include <string>

#include <CLI/CLI.hpp>

#include "calib/files/input_error.h"
#include "calib/program.h"
#include "lcmtypes/link/link_key.h"

int main(int argc, char** argv) {
  using namespace vantage;
  CLI::App app("Makes the key that robot and workstation share: copy it to both, mode 0600, and give --key FILE.",
               "vantage-keygen");
  std::string file;
  app.add_option("FILE", file, "where the key goes; must not exist")->required();
  app.set_version_flag("--version", VANTAGE_VERSION);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitOk : kExitBadInput;
  }
  return run_program("vantage-keygen", [&] {
    write_link_key(file, make_link_key());
    std::printf("%s: a new key; copy it to the other computer, e.g. by  scp -p\n", file.c_str());
    return static_cast<int>(kExitOk);
  });
}
