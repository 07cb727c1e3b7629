#!/usr/bin/env python3
"""Writes golden.yaml: outputs and derivatives of some networks, computed with numpy and shared with nothing
of this package. Derivatives are complex steps, exact to rounding: d f = Im f(x + i h) / h with h = 1e-30
(Squire & Trapp 1998).   usage: make_golden.py >golden.yaml"""
import numpy as np

STEP = 1e-30
ACTIVATIONS = {
    'linear': lambda s: s,
    'tanh': np.tanh,
    'sigmoid': lambda s: 1.0 / (1.0 + np.exp(-s)),
    'relu': lambda s: np.where(s.real > 0.0, s, 0.0),
}


def dense(inputs, outputs, activation):
    return {'kind': 'dense', 'activation': activation, 'channels_in': 1, 'length_in': inputs,
            'channels_out': outputs, 'kernel': inputs, 'stride': 1, 'passed': 0}


def convolution(channels_in, length_in, channels_out, kernel, stride, passed, activation):
    return {'kind': 'convolution', 'activation': activation, 'channels_in': channels_in,
            'length_in': length_in, 'channels_out': channels_out, 'kernel': kernel, 'stride': stride,
            'passed': passed}


def parameters_of(layer):
    return layer['channels_out'] * (layer['channels_in'] * layer['kernel'] + 1)


def run_layer(layer, p, x):
    channels, length = layer['channels_in'], layer['length_in']
    count = layer['channels_out'] * channels * layer['kernel']
    weights = p[:count].reshape(layer['channels_out'], channels, layer['kernel'])
    bias = p[count:]
    signals = x[:channels * length].reshape(channels, length)
    rows = []
    for channel in range(layer['channels_out']):
        # numpy's convolution turns its kernel round and conjugates nothing: turned twice it correlates.
        total = sum(np.convolve(signals[i], weights[channel, i, ::-1], mode='valid')
                    for i in range(channels))
        rows.append(total[::layer['stride']] + bias[channel])
    out = ACTIVATIONS[layer['activation']](np.concatenate(rows))
    return np.concatenate([out, x[channels * length:]])


def run(layers, p, x):
    at = 0
    for layer in layers:
        x = run_layer(layer, p[at:at + parameters_of(layer)], x)
        at += parameters_of(layer)
    return x


def derivative(function, values):
    result = []
    for i in range(len(values)):
        moved = values.astype(complex)
        moved[i] += STEP * 1j
        result.append(function(moved).imag / STEP)
    return result


def text(numbers):
    return '[' + ', '.join(f'{float(n):.17g}' for n in numbers) + ']'


def main():
    networks = [(f'dense {a}', [dense(7, 6, a), dense(6, 3, a)]) for a in ACTIVATIONS]
    networks += [(f'convolution {a}', [convolution(2, 15, 3, 4, 2, 1, a),
                                       convolution(3, 6, 2, 3, 1, 1, a),
                                       dense(9, 2, 'sigmoid')]) for a in ACTIVATIONS]
    networks += [('one channel, steps past the end', [convolution(1, 20, 5, 6, 4, 0, 'tanh')]),
                 ('wide', [dense(40, 17, 'tanh'), dense(17, 33, 'sigmoid')])]
    random = np.random.RandomState(1)
    print('# Made by make_golden.py. `weights`: the derivatives are those of their sum with the outputs.')
    print('networks:')
    for name, layers in networks:
        p = random.uniform(-1.0, 1.0, sum(parameters_of(layer) for layer in layers))
        x = random.uniform(-1.0, 1.0, layers[0]['channels_in'] * layers[0]['length_in'] + layers[0]['passed'])
        y = run(layers, p, x)
        weights = random.uniform(-1.0, 1.0, len(y))
        print(f'- name: {name}\n  layers:')
        for layer in layers:
            print('  - {' + ', '.join(f'{key}: {value}' for key, value in layer.items()) + '}')
        print('  parameters:', text(p))
        print('  input:', text(x))
        print('  output:', text(y))
        print('  weights:', text(weights))
        print('  parameter_gradient:', text(derivative(lambda q: weights @ run(layers, q, x), p)))
        print('  input_gradient:', text(derivative(lambda z: weights @ run(layers, p, z), x)))


main()
