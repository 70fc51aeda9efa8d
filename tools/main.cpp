#include "tools/program_main.hpp"

int main(int argc, char** argv) { return stageid::program_main(argc, argv, stageid::Team::one()); }
