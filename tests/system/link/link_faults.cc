// What somebody on the network may try against two running programs, and a witness of what they acknowledge:
// scripts/test-link-faults.

#include "tests/system/link/link_faults.h"

#include <CLI/CLI.hpp>

#include "calib/program.h"

int main(int argc, char** argv) {
  using namespace vantage;
  CLI::App app("Attacks on two running programs, and a witness of what they acknowledge.", "link_faults");
  FaultArguments arguments;
  int (*chosen)(const FaultArguments&) = nullptr;
  const auto add = [&](const char* name, int (*what)(const FaultArguments&)) {
    CLI::App* sub = app.add_subcommand(name);
    sub->callback([&chosen, what] { chosen = what; });
    sub->add_option("--key", arguments.key, "the programs' key");
    sub->add_option("--file", arguments.file, "of acknowledgements");
    sub->add_option("--log", arguments.log, "of the planner's session");
    sub->add_option("--count", arguments.count, "of forgeries or mutations")->check(CLI::PositiveNumber);
    sub->add_option("--pids", arguments.pids, "whose memory is watched");
    sub->add_option("--seed", arguments.seed);
  };
  add("witness", &witness_acknowledgements);
  add("verify", &verify_acknowledgements);
  add("forge", &forge_commands);
  add("mutate", &mutate_datagrams);
  app.require_subcommand(1);
  CLI11_PARSE(app, argc, argv);
  return run_program("link_faults", [&] { return chosen(arguments); });
}
