// operate: an operator's edge to a bridge that listens on a local socket.
#include <boost/asio/io_context.hpp>
#include <boost/asio/local/stream_protocol.hpp>
#include <boost/asio/read_until.hpp>
#include <boost/asio/write.hpp>
#include <boost/program_options.hpp>
#include <exception>
#include <iostream>
#include <string>

namespace {

namespace options = boost::program_options;
using Local = boost::asio::local::stream_protocol;

constexpr int kAccepted = 0;
constexpr int kRefused = 1;
constexpr int kBadInput = 2;

struct Arguments {
  std::string edge;
  std::string socket;
};

// False when only help was asked for. Throws options::error.
bool parse(int argc, char** argv, Arguments& arguments) {
  options::options_description shown(
      "operate engage|release|stop|reset: an operator's edge, by the bridge's local socket.\nOptions");
  shown.add_options()("help,h", "this text")(
      "edge", options::value(&arguments.edge)->required(),
      "engage, release, stop or reset; also without the option's name")(
      "socket",
      options::value(&arguments.socket)
          ->default_value("/run/tunnel_pilot/operator.sock")
          ->value_name("FILE"),
      "where the bridge listens: its operator_socket");
  options::positional_options_description positional;
  positional.add("edge", 1);
  options::variables_map values;
  options::store(options::command_line_parser(argc, argv).options(shown).positional(positional).run(),
                 values);
  if (values.count("help") != 0) {
    std::cout << shown << "Exit status: 0 accepted, 1 refused, 2 bad input or nobody listens.\n";
    return false;
  }
  options::notify(values);
  return true;
}

std::string ask(const Arguments& arguments) {
  boost::asio::io_context context;
  Local::socket bridge(context);
  bridge.connect(Local::endpoint(arguments.socket));
  boost::asio::write(bridge, boost::asio::buffer(arguments.edge + "\n"));
  std::string answer;
  boost::asio::read_until(bridge, boost::asio::dynamic_buffer(answer), '\n');
  return answer.substr(0, answer.find('\n'));
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  try {
    if (!parse(argc, argv, arguments)) return kAccepted;
    const std::string answer = ask(arguments);
    std::cout << arguments.edge << ": " << answer << "\n";
    return answer == "ok" ? kAccepted : kRefused;
  } catch (const options::error& error) {
    std::cerr << "operate: " << error.what() << " (try --help)\n";
    return kBadInput;
  } catch (const std::exception& error) {
    std::cerr << "operate: " << arguments.socket << ": " << error.what() << "\n";
    return kBadInput;
  }
}
